"""The example `bouncing_ball` as a plain slave of PythonFMU, which takes one step a call."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

GROUND = 2.2250738585072014e-308


class BouncingBall(Fmi2Slave):
    """A ball that falls, bounces and comes to rest."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.g, self.e, self.v_min = -9.81, 0.7, 0.1
        self.h, self.v, self.rests = 1.0, 0.0, False
        for name in ("g", "e", "v_min"):
            self.register_variable(
                Real(name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed)
            )
        for name in ("h", "v"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        if self.rests:
            return True
        self.h, self.v = self.h + step_size * self.v, self.v + step_size * self.g
        if self.h <= 0 and self.v < 0:
            self.h, self.v = GROUND, -self.v * self.e
            if self.v < self.v_min:
                self.v, self.rests = 0.0, True
        return True
