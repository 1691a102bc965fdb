"""Long computations in separate, limited processes beside the page's server."""
