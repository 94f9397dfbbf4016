"""Many runs: what varies, the engines that make them, and what is kept of them.

Begin with `study`, then `sweep`.
"""
