"""The model file: effects with their fitted parameters, as a document and as what the daemon and the workbench load."""
