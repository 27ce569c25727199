"""Deciders on recordings of objects of any size, whose switches are not known."""
