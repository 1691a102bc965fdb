"""What instruments write: reading their exports, and writing plans and samples in the same shapes."""
