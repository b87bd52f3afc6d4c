"""Ray and SLURM tried on two machines, which are namespaces of this one."""
