"""Which geoms collide with which, as MuJoCo's bit masks `contype` and `conaffinity`.

Everything collides in the common layer. A prop may add geoms that touch the table alone by giving them contype
`TABLE_ONLY` and conaffinity 0, or dirt alone by `DIRT_ONLY`: dirt has that bit in its conaffinity.
"""

COMMON_LAYER = 1
TABLE_ONLY = 2
DIRT_ONLY = 4
