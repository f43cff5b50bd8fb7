"""Files of others: elevation models and radars' own forms, read as plain arrays."""
