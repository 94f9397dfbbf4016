"""Systems in the user's hands: one that is stepped, or many side by side."""
