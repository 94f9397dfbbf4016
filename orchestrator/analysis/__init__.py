"""The loop's signals: indices, certificates, gains, figures, film."""
