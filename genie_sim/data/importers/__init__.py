"""Files of others: ``trace_import`` is the waist through which every reader's frames pass."""
