"""A gauge that no driver knows: its replies captured, what they mean asked, its description written and read back."""
