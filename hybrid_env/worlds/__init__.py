"""What the classes of environments stand on: the arrays of N tracks, and the code that all of them share.

`tracks` allocates, steps, saves and restores the arrays that `core.state` declares; `world` and
`quickest_world` are those with announced and with unknown switches, and `live` both on a live sensor.
`track_env` and `track_vector_env` are the base classes of the environments, and `lazy_info` their info.
"""
