"""The banks of filters. `filter` has the equations of all of them, and `sensing` the correction by
what is not a position of variance R. `published`, `anchor_aware` and, with unknown switches, `imm`
read and write the filters of many tracks; the kernel calls them by `operations`. `posterior` weighs
the hypotheses of a bank and merges their estimates, and `bank` has what all banks share.
"""
