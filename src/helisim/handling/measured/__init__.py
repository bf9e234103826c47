"""What flight records alone say of a closed loop: its responses, with their uncertainty.

A signal that the control law doesn't know was injected: at a servo command, at an attitude or a
rate that is sensed, or by a stick. What follows it, each signal over what was injected, are
responses of the closed loop; broken loops are their quotients.
"""
