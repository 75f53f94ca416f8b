"""PerAct and its relatives: voxels in, keyposes out. `examples/peract2_written_out.py` has the method written out: read it first."""
