"""What limits a decision: rules with more and more information, on every bank and noise level."""
