"""Many runs: what varies, the engines that make the runs, and their files.

Begin with `study`, then `sweep`.
"""
