"""The commands `hybridtrack train | evaluate | compare | play | track | score`, one file each."""
