"""What to run next: the manoeuvre that discriminates the candidates that a diagnosis leaves."""
