"""Does the agent also work where others wrote the simulator?"""
