"""What a term and a support are, and the kinematics that terms ask for."""
