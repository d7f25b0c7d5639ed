"""`~/rollout`: simulates sequences of controls in copies of the state, on threads of their own."""
