"""What is odd about records before anything is computed from them: findings with severity, place, size and remedy."""
