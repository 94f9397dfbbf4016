"""The example `step_response` as a plain slave of PythonFMU."""

from math import exp

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class StepResponse(Fmi2Slave):
    """The response of a first-order lag to a step."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.a, self.tau = 5.0, 2.0
        self.realIn, self.realOut = 22.0, 0.0
        for name in ("a", "tau"):
            self.register_variable(
                Real(name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable)
            )
        self.register_variable(Real("realIn", causality=Fmi2Causality.input))
        self.register_variable(Real("realOut", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        t = current_time + step_size
        self.realOut = self.realIn * self.a * (1.0 - exp(-t / self.tau))
        return True
