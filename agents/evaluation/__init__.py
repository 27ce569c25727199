"""What is decided (`task` and its subclasses), deciders by name (`registry`), and how both are
scored and shown.
"""
