# No types: rules take whatever is a number.
