"""What was really there: what consumers hold, and answers, compared with the truth."""
