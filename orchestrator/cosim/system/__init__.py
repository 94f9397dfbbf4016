"""What is simulated: components as their ports, connections and parameters.

Begin with `structure`. Nothing here knows which components there are.
"""
