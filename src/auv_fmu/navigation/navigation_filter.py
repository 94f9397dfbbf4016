"""An error-state Kalman filter that fuses IMU, depth, attitude, velocity and position samples.

After Solà (2017), "Quaternion kinematics for the error-state Kalman filter", arXiv:1711.02508,
chapters 5 to 7: the nominal state is integrated from the IMU, and a Kalman filter estimates its
error

    dx = (dp, dv, dtheta, da_b, domega_b),    q_true = exp(dtheta) q,

with the angular error in the earth frame (chapter 7), in which it does not turn with the vehicle.
With R and h, the rotation and the step, and a = R (f - a_b):

    p <- p + h v + h^2 / 2 (a + g)        dp     <- dp + h dv
    v <- v + h (a + g)                    dv     <- dv - h [a]x dtheta - h R da_b
    q <- q exp(h (omega - omega_b))       dtheta <- dtheta - h R domega_b

All samples that have arrived in a step are one measurement, linear about the prediction. Their
noises are independent, so it is applied number by number, which inverts no matrix. The estimated
error goes into the nominal state; the reset of the covariance is the identity, as the source
suggests.

A sample with an age is compared with the state at its time. For that the filter remembers V, W and
G, which are velocity, position and attitude integrated from the IMU without corrections. With d for
the age, and "then" for the time of the sample:

    p_then = p - d (v - V) - (W - W_then),   v_then = v - (V - V_then),   q_then = q G^-1 G_then
    dp_then = dp - d dv - [v d - (p - p_then) - g d^2 / 2]x dtheta - d^2 / 2 R da_b
    dv_then = dv + [v - v_then - g d]x dtheta + d R da_b
    dtheta_then = dtheta + d R domega_b

That is exact except for the noise of the IMU within the age, and for the effect of its biases there
while the vehicle turns.
"""

from __future__ import annotations

from math import radians, sqrt
from typing import Annotated, NamedTuple

from auv_fmu.language.arrays import Matrix, Vector
from auv_fmu.language.quantities import ACCELERATION, ETA, NU, POSITION, VELOCITY, Members
from auv_fmu.language.variable import POSITIVE, Variable
from auv_fmu.language.vectors import (
    Rotation,
    Vector3,
    Vector4,
    Vector6,
    add,
    add_scaled,
    cross,
    scale,
    sub,
)
from auv_fmu.navigation.rotations import exponential, inverse, logarithm, product
from auv_fmu.navigation.sensors import (
    BODY_RATE,
    GRAVITY,
    Accelerometer,
    AttitudeSample,
    DepthSample,
    Gyro,
    InertialSample,
    PositionSample,
    VelocitySample,
)
from auv_fmu.paper.attitude import (
    euler_from_rotation,
    normalised,
    quaternion_from_euler,
    rotate,
    rotate_back,
    rotation_from_quaternion,
)
from auv_fmu.paper.control_point import ELL, Distance, control_point, control_point_velocity

#: Number of error states, and how many of them are position, velocity and attitude.
SIZE, SHOWN = 15, 9

#: Most numbers in a measurement.
MOST = 10

#: Numbers in the lower triangle of the covariance that is shown.
TRIANGLE = SHOWN * (SHOWN + 1) // 2

#: Moments that the filter remembers, and numbers of each: time, V, W and G.
MOMENTS, _NUMBERS = 64, 11

#: Tolerance for rounded times [s], and as a share of the time between two moments.
_MOMENT = 1e-9
_ROUNDING = 1e-6

_ZERO = (0.0, 0.0, 0.0)
_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

#: Members of an error of the attitude: a rotation vector in the earth frame.
_TURN: Members = {"north": "rad", "east": "rad", "down": "rad"}


class Noise(NamedTuple):
    """Standard deviations of the noise of the sensors."""

    depth: Annotated[float, Variable("m", "Noise of the depth", POSITIVE)] = 0.002
    tilt: Annotated[float, Variable("rad", "Noise of the attitude, horizontal axes", POSITIVE)] = (
        radians(0.5)
    )
    heading: Annotated[float, Variable("rad", "Noise of the attitude, vertical axis", POSITIVE)] = (
        radians(2.0)
    )
    velocity: Annotated[float, Variable("m/s", "Noise of the velocity, each axis", POSITIVE)] = 0.01
    position: Annotated[
        Vector3, Variable(POSITION, "Noise of the position", POSITIVE, name="{}")
    ] = (0.3, 0.3, 0.3)


class Start(NamedTuple):
    """Standard deviations at the start, where no sample is fresh."""

    position: Annotated[float, Variable("m", "Position, each axis, at the start", POSITIVE)] = 10.0
    velocity: Annotated[float, Variable("m/s", "Velocity, each axis, at the start", POSITIVE)] = 1.0
    attitude: Annotated[float, Variable("rad", "Attitude, each axis, at the start", POSITIVE)] = 0.1


class Parameters(NamedTuple):
    """All parameters of the filter; the defaults are the sensors'."""

    gyro: Gyro = Gyro()
    accelerometer: Accelerometer = Accelerometer()
    noise: Noise = Noise()
    start: Annotated[Start, Variable(name="std0")] = Start()
    delay_max: Annotated[float, Variable("s", "Largest age of a sample that is used", POSITIVE)] = (
        1.0
    )
    ell: Distance = ELL


class Samples(NamedTuple):
    """Samples of all sensors."""

    imu: InertialSample = InertialSample()
    attitude: AttitudeSample = AttitudeSample()
    depth: DepthSample = DepthSample()
    dvl: VelocitySample = VelocitySample()
    fix: PositionSample = PositionSample()


class Nominal(NamedTuple):
    """The nominal state."""

    position: Vector3  #: [m], earth frame
    velocity: Vector3  #: over ground [m/s], earth frame
    attitude: Vector4  #: unit quaternion
    force: Vector3  #: bias of the accelerometer [m/s2]
    rate: Vector3  #: bias of the gyro [rad/s]


class Path(NamedTuple):
    """Integrals of the IMU's samples without corrections."""

    V: Vector3  #: velocity less that at the start [m/s]
    W: Vector3  #: its integral [m]
    G: Vector4  #: attitude, from the identity at the start


class FilterState(NamedTuple):
    """State of the filter."""

    t: float  #: time of the last step [s]
    nominal: Nominal
    P: Annotated[Matrix, SIZE, SIZE]  #: covariance of the error
    path: Path
    memory: Annotated[Matrix, MOMENTS, _NUMBERS]
    newest: int  #: place of the newest moment in the memory


class Measurement(NamedTuple):
    """All numbers that have arrived in a step; the first n rows count."""

    H: Annotated[Matrix, MOST, SIZE]  #: their Jacobian
    innovation: Annotated[Vector, MOST]  #: the numbers less their predictions
    std: Annotated[Vector, MOST]  #: standard deviations of their noises
    n: int


class Correction(NamedTuple):
    """Estimate of the error, and how well the samples agree with the prediction."""

    P: Annotated[Matrix, SIZE, SIZE]
    dx: Annotated[Vector, SIZE]
    nis: float  #: normalised innovation squared


class Then(NamedTuple):
    """The state at the time of a sample."""

    known: bool  #: the filter remembers that time
    age: float  #: [s]
    position: Vector3
    velocity: Vector3
    attitude: Vector4
    axes: Rotation  #: rows of R at present, the earth axes in the body frame


class Filtered(NamedTuple):
    """State after the samples of a step, and how well they agreed."""

    state: FilterState
    rate: Vector3  #: (p, q, r) without bias [rad/s]
    nis: float
    dof: int


class Deviations(NamedTuple):
    """Standard deviations of the estimates."""

    position: Annotated[
        Vector3, Variable(POSITION, "Standard deviation of the position", name="{}")
    ]
    velocity: Annotated[
        Vector3, Variable(VELOCITY, "Standard deviation of the velocity, earth frame", name="d{}")
    ]
    turn: Annotated[
        Vector3, Variable(_TURN, "Standard deviation of the attitude, earth axes", name="{}")
    ]
    force: Annotated[
        Vector3,
        Variable(ACCELERATION, "Standard deviation of the accelerometer's bias", name="f_{}"),
    ]
    rate: Annotated[
        Vector3, Variable(BODY_RATE, "Standard deviation of the gyro's bias", name="{}")
    ]


class Biases(NamedTuple):
    """Estimated biases of the IMU."""

    force: Annotated[
        Vector3, Variable(ACCELERATION, "Estimated bias of the accelerometer", name="f_{}")
    ]
    rate: Annotated[Vector3, Variable(BODY_RATE, "Estimated bias of the gyro", name="{}")]


class Estimates(NamedTuple):
    """Estimates for a controller, and numbers for a test of consistency."""

    y: Annotated[Vector3, Variable(POSITION, "Estimated control point")]
    dy: Annotated[Vector3, Variable(VELOCITY, "Estimated velocity of the control point")]
    eta: Annotated[Vector6, Variable(ETA, "Estimated position and Euler angles")]
    nu: Annotated[Vector6, Variable(NU, "Estimated velocity over ground in the body frame")]
    bias: Biases
    std: Deviations
    P: Annotated[
        Vector,
        TRIANGLE,
        Variable("1", "Covariance of the errors of position, velocity and attitude, in SI units"),
    ]
    nis: Annotated[float, Variable("1", "Normalised innovation squared of this step's samples")]
    dof: Annotated[int, Variable("1", "Number of their numbers, the degrees of freedom of nis")]


def begin(parameters: Parameters, samples: Samples, t: float) -> FilterState:
    """State at the start, from the samples of the start.

    Args:
        parameters: of the filter.
        samples: of the sensors; what has not arrived is zero, and as uncertain as `std0` says.
        t: time [s].

    """
    noise, start = parameters.noise, parameters.start
    phi, theta, psi = samples.attitude.eta
    nominal = Nominal(
        samples.fix.position, _ZERO, quaternion_from_euler(phi, theta, psi), _ZERO, _ZERO
    )
    position = (start.position, start.position, start.position)
    if samples.fix.fresh:
        position = noise.position
    turn = (start.attitude, start.attitude, start.attitude)
    if samples.attitude.fresh:
        turn = (noise.tilt, noise.tilt, noise.heading)
    velocity, force, rate = start.velocity, parameters.accelerometer.bias, parameters.gyro.bias
    std = Vector(
        (
            *position,
            *(velocity, velocity, velocity),
            *turn,
            *(force, force, force),
            *(rate, rate, rate),
        )
    )
    P = Matrix(((std[i] * std[i] if i == j else 0.0) for j in range(SIZE)) for i in range(SIZE))
    path = Path(_ZERO, _ZERO, (1.0, 0.0, 0.0, 0.0))
    row = moment(t, path)
    memory = Matrix((row[j] for j in range(_NUMBERS)) for i in range(MOMENTS))
    return FilterState(t, nominal, P, path, memory, 0)


def moment(t: float, path: Path) -> Vector:
    """A moment to be remembered: time t [s] and the path then."""
    return Vector((t, *path.V, *path.W, *path.G))


def advance(parameters: Parameters, state: FilterState, samples: Samples, t: float) -> Filtered:
    """State after the samples of time t.

    Args:
        parameters: of the filter.
        state: after the last step.
        samples: of the sensors at time t.
        t: time [s].

    """
    h = t - state.t
    rate = sub(samples.imu.omega, state.nominal.rate)
    if h > 0.0:
        state = predicted(parameters, state, samples.imu, h)
        state = remembered(parameters, state, t)
    found = measurement(parameters, state, samples, h > 0.0)
    P, dx, nis = correction(state.P, found)
    state = state._replace(nominal=injected(state.nominal, dx), P=P)
    return Filtered(state, rate, nis, found.n)


def predicted(
    parameters: Parameters, state: FilterState, imu: InertialSample, h: float
) -> FilterState:
    """State before the samples of a step are applied.

    Args:
        parameters: of the filter.
        state: after the last step.
        imu: means of the step.
        h: step [s].

    """
    position, velocity, attitude, force, rate = state.nominal
    rotation = rotation_from_quaternion(attitude)
    specific = rotate(rotation, sub(imu.f, force))
    acceleration = (specific[0], specific[1], specific[2] + GRAVITY)
    turn = exponential(scale(h, sub(imu.omega, rate)))
    nominal = Nominal(
        add_scaled(add_scaled(position, h, velocity), 0.5 * h * h, acceleration),
        add_scaled(velocity, h, acceleration),
        normalised(product(attitude, turn)),
        force,
        rate,
    )
    V, W, G = state.path
    path = Path(
        add_scaled(V, h, acceleration),
        add_scaled(add_scaled(W, h, V), 0.5 * h * h, acceleration),
        normalised(product(G, turn)),
    )
    # F P F' = F (F P)', because P is symmetric.
    P = transferred(transferred(state.P, specific, rotation, h).T, specific, rotation, h)
    P = 0.5 * (P + P.T)
    variances = process_noise(parameters, h)
    P = Matrix(
        (P[i, j] + (variances[i] if i == j else 0.0) for j in range(SIZE)) for i in range(SIZE)
    )
    return FilterState(state.t + h, nominal, P, path, state.memory, state.newest)


def transferred(P: Matrix, specific: Vector3, rotation: Rotation, h: float) -> Matrix:
    """F P, with the transition F of the error; it is the identity except for a few blocks.

    Args:
        P: any matrix with as many rows as there are errors.
        specific: R (f - a_b) [m/s2], earth frame.
        rotation: R, body to earth.
        h: step [s].

    """
    a, b, c = rotation
    x, y, z = specific
    moved = P
    for i in range(3):
        moved = moved.replaced(i, P[i] + h * P[3 + i])
        force = a[i] * P[9] + b[i] * P[10] + c[i] * P[11]
        moved = moved.replaced(3 + i, P[3 + i] - h * force)
        rate = a[i] * P[12] + b[i] * P[13] + c[i] * P[14]
        moved = moved.replaced(6 + i, P[6 + i] - h * rate)
    moved = moved.replaced(3, moved[3] + (h * z) * P[7] - (h * y) * P[8])
    moved = moved.replaced(4, moved[4] + (h * x) * P[8] - (h * z) * P[6])
    return moved.replaced(5, moved[5] + (h * y) * P[6] - (h * x) * P[7])


def process_noise(parameters: Parameters, h: float) -> Vector:
    """Variances that the errors gain in a step of h seconds."""
    force, rate = parameters.accelerometer, parameters.gyro
    v, turn = h * force.noise * force.noise, h * rate.noise * rate.noise
    a, w = h * force.walk * force.walk, h * rate.walk * rate.walk
    return Vector((0.0, 0.0, 0.0, v, v, v, turn, turn, turn, a, a, a, w, w, w))


def remembered(parameters: Parameters, state: FilterState, t: float) -> FilterState:
    """State that remembers the path at time t [s], if the newest moment is old enough."""
    spacing = parameters.delay_max / (MOMENTS - 1)
    if t - state.memory[state.newest, 0] < (1.0 - _ROUNDING) * spacing:
        return state
    place = (state.newest + 1) % MOMENTS
    return state._replace(memory=state.memory.replaced(place, moment(t, state.path)), newest=place)


def then(state: FilterState, age: float) -> Then:
    """The state some time ago.

    Args:
        state: predicted.
        age: how long ago [s].

    """
    position, velocity, attitude, _, _ = state.nominal
    a, b, c = rotation_from_quaternion(attitude)
    axes = (a[0], b[0], c[0]), (a[1], b[1], c[1]), (a[2], b[2], c[2])
    if age <= _MOMENT:
        return Then(True, 0.0, position, velocity, attitude, axes)
    time = state.t - age
    newer, older = moment(state.t, state.path), state.memory[state.newest]
    k = 1
    while older[0] > time + _MOMENT and k < MOMENTS:
        newer = older
        older = state.memory[(state.newest - k) % MOMENTS]
        k = k + 1
    if older[0] > time + _MOMENT:
        return Then(False, age, position, velocity, attitude, axes)
    between = newer[0] - older[0]
    share = (time - older[0]) / between if between > 0.0 else 0.0
    mean = older + share * (newer - older)
    V, W, G = (mean[1], mean[2], mean[3]), (mean[4], mean[5], mean[6]), mean[7:]
    back = product(inverse(state.path.G), normalised((G[0], G[1], G[2], G[3])))
    return Then(
        True,
        age,
        sub(add_scaled(position, -age, sub(velocity, state.path.V)), sub(state.path.W, W)),
        sub(velocity, sub(state.path.V, V)),
        product(attitude, back),
        axes,
    )


def measurement(
    parameters: Parameters, state: FilterState, samples: Samples, later: bool
) -> Measurement:
    """All numbers that have arrived, linear about the prediction.

    Args:
        parameters: of the filter.
        state: predicted.
        samples: of the sensors.
        later: false at the start, whose attitude and position are the state already.

    """
    noise, nominal = parameters.noise, state.nominal
    zero = Vector((0.0,) * MOST)
    found = Measurement(Matrix((0.0 for j in range(SIZE)) for i in range(MOST)), zero, zero, 0)
    if samples.attitude.fresh and later:
        past = then(state, samples.attitude.age)
        phi, theta, psi = samples.attitude.eta
        attitude = quaternion_from_euler(phi, theta, psi)
        turn = logarithm(product(attitude, inverse(past.attitude)))
        std = (noise.tilt, noise.tilt, noise.heading)
        for k in range(3):
            H = row(_ZERO, _ZERO, _AXES[k], _ZERO, scale(past.age, past.axes[k]))
            found = noted(found, past, H, turn[k], std[k])
    if samples.depth.fresh:
        past = then(state, samples.depth.age)
        H = position_row(nominal, past, 2)
        found = noted(found, past, H, samples.depth.z - past.position[2], noise.depth)
    if samples.dvl.fresh:
        past = then(state, samples.dvl.age)
        rotation = rotation_from_quaternion(past.attitude)
        expected = rotate_back(rotation, past.velocity)
        v_x, v_y, v_z = nominal.velocity
        velocity = (v_x, v_y, v_z - past.age * GRAVITY)
        for k in range(3):
            turn = cross(rotation[k], velocity)
            H = row(_ZERO, rotation[k], turn, scale(past.age, _AXES[k]), _ZERO)
            found = noted(found, past, H, samples.dvl.nu[k] - expected[k], noise.velocity)
    if samples.fix.fresh and later:
        past = then(state, samples.fix.age)
        for k in range(3):
            H = position_row(nominal, past, k)
            innovation = samples.fix.position[k] - past.position[k]
            found = noted(found, past, H, innovation, noise.position[k])
    return found


def row(
    position: Vector3, velocity: Vector3, turn: Vector3, force: Vector3, rate: Vector3
) -> Vector:
    """A row of the Jacobian of a measurement."""
    return Vector((*position, *velocity, *turn, *force, *rate))


def position_row(nominal: Nominal, past: Then, k: int) -> Vector:
    """The row of an axis k of the position at the time of a sample."""
    age, axis = past.age, _AXES[k]
    moved = sub(nominal.position, past.position)
    x, y, z = sub(scale(age, nominal.velocity), moved)
    turn = cross((x, y, z - 0.5 * age * age * GRAVITY), axis)
    force = scale(-0.5 * age * age, past.axes[k])
    return row(axis, scale(-age, axis), turn, force, _ZERO)


def noted(found: Measurement, past: Then, H: Vector, innovation: float, std: float) -> Measurement:
    """A measurement with one more number, unless the filter does not remember its time.

    Args:
        found: the measurement before.
        past: state at the time of the number.
        H: its Jacobian.
        innovation: the number less its prediction.
        std: standard deviation of its noise.

    """
    if not past.known:
        return found
    n = found.n
    return Measurement(
        found.H.replaced(n, H),
        found.innovation.replaced(n, innovation),
        found.std.replaced(n, std),
        n + 1,
    )


def correction(P: Matrix, found: Measurement) -> Correction:
    """Estimate of the error from a measurement, applied number by number.

    Args:
        P: covariance of the predicted error.
        found: the measurement.

    """
    dx, nis = Vector((0.0,) * SIZE), 0.0
    for k in range(MOST):
        if k >= found.n:
            break
        H, std = found.H[k], found.std[k]
        PH = P @ H
        variance = H @ PH + std * std
        rest = found.innovation[k] - H @ dx
        w = PH / sqrt(variance)
        P = Matrix((P[i, j] - w[i] * w[j] for j in range(SIZE)) for i in range(SIZE))
        dx = dx + (rest / variance) * PH
        nis = nis + rest * rest / variance
    return Correction(P, dx, nis)


def injected(nominal: Nominal, dx: Vector) -> Nominal:
    """The nominal state with the estimated error."""
    return Nominal(
        add(nominal.position, (dx[0], dx[1], dx[2])),
        add(nominal.velocity, (dx[3], dx[4], dx[5])),
        normalised(product(exponential((dx[6], dx[7], dx[8])), nominal.attitude)),
        add(nominal.force, (dx[9], dx[10], dx[11])),
        add(nominal.rate, (dx[12], dx[13], dx[14])),
    )


def estimates(parameters: Parameters, filtered: Filtered) -> Estimates:
    """Outputs of the filter.

    Args:
        parameters: of the filter.
        filtered: state after the samples of a step.

    """
    position, velocity, attitude, force, rate = filtered.state.nominal
    P = filtered.state.P
    rotation = rotation_from_quaternion(attitude)
    u, v, w = rotate_back(rotation, velocity)
    nu = (u, v, w, *filtered.rate)
    return Estimates(
        control_point(position, rotation, parameters.ell),
        control_point_velocity(rotation, nu, parameters.ell),
        (*position, *euler_from_rotation(rotation)),
        nu,
        Biases(force, rate),
        Deviations(
            deviation(P, 0), deviation(P, 3), deviation(P, 6), deviation(P, 9), deviation(P, 12)
        ),
        triangle(P),
        filtered.nis,
        filtered.dof,
    )


def deviation(P: Matrix, k: int) -> Vector3:
    """Standard deviations of three errors from place k on."""
    return sqrt(P[k, k]), sqrt(P[k + 1, k + 1]), sqrt(P[k + 2, k + 2])


def triangle(P: Matrix) -> Vector:
    """The lower triangle of the covariance of position, velocity and attitude, row by row."""
    numbers = Vector((0.0,) * TRIANGLE)
    place = 0
    for i in range(SHOWN):
        for j in range(i + 1):
            numbers = numbers.replaced(place, P[i, j])
            place = place + 1
    return numbers
