"""The example `resistor` as a plain slave of PythonFMU."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Resistor(Fmi2Slave):
    """An ohmic resistor between two pins."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.R = 10000.0
        self.positive_pin_v, self.negative_pin_v = 20.0, 10.0
        self.positive_pin_i = self.negative_pin_i = self.delta_v = self.i = 0.0
        parameter, tunable = Fmi2Causality.parameter, Fmi2Variability.tunable
        self.register_variable(Real("R", causality=parameter, variability=tunable))
        for name in ("positive_pin_v", "negative_pin_v"):
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        for name in ("positive_pin_i", "negative_pin_i", "delta_v", "i"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def exit_initialization_mode(self):
        self.do_step(0.0, 0.0)

    def do_step(self, current_time, step_size):
        self.delta_v = self.positive_pin_v - self.negative_pin_v
        self.i = self.delta_v / self.R
        self.positive_pin_i, self.negative_pin_i = self.i, -self.i
        return True
