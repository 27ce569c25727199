"""When a glider begins to circle, on which side, and when it leaves: rules and an agent."""
