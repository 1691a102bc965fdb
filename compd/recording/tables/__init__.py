"""The table of a recording's file, before its columns have a meaning: CSV and Parquet as columns of numbers."""
