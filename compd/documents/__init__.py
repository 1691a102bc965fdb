"""YAML documents as people write them: read with the line of every key, checked by models, mistakes in words."""
