"""How far rules and the shipped agent are from the optimum, where nobody announces a switch."""
