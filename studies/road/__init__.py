"""Does learning pay where no bank tells the truth?"""
