"""Networks fitted to shapes: SIRENs to one, DeepSDFs to many."""
