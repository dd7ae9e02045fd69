"""How the machine depends on the head's position, exactly: constant matrices and the rail's shapes."""

from cutvib_ss.affine.form import AffineMachine, Rider, affine_machine
from cutvib_ss.affine.terms import AffineTerms, affine_terms

__all__ = ["AffineMachine", "AffineTerms", "Rider", "affine_machine", "affine_terms"]
