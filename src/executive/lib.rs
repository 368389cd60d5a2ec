//! The pure test executive: quantities, limits, plans, run events and state, records as text.
