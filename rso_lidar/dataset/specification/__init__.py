"""The specification of a dataset as parts: classes, laws, views, splits and labels."""
