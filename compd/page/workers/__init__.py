"""Work that takes long, in processes of its own with limits, beside the page's server."""
