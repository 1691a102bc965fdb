"""The search: sets of candidates and descriptions, judged by the rows that they predict when these are left out."""
