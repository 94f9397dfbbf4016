"""The example `van_der_pol` as a plain slave of PythonFMU, which takes one step a call."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class VanDerPol(Fmi2Slave):
    """The van der Pol oscillator."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.mu, self.x0, self.x1 = 1.0, 2.0, 0.0
        self.register_variable(
            Real("mu", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable)
        )
        for name in ("x0", "x1"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        x0, x1 = self.x0, self.x1
        acceleration = self.mu * ((1 - x0 * x0) * x1) - x0
        self.x0 += step_size * x1
        self.x1 += step_size * acceleration
        return True
