"""The banks of filters: `published` stands on `kalman`, `anchor_aware` on `extended_kalman`; the
kernel calls both by `operations`. `imm` is for unknown switch moments. With a radar, `sensing`
corrects the filters. `mixture` merges the estimates of a bank, and `bank` has what all banks share.
"""
