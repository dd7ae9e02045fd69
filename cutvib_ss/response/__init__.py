"""What a model does: modes and poles, frequency responses in closed form and their derivatives, time responses."""
