"""PerAct and its relatives: voxels in, keyposes out. `reference.py` has the method written out: read it first."""
