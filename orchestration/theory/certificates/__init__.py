"""Proofs that a sampled linear loop stays stable whatever its timing does, and the checker of such proofs."""
