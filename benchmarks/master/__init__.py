"""Time this project's master beside other co-simulation tools."""
