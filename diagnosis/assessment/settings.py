"""Constants by which this room decides; no command has an option for them."""

from dataclasses import dataclass


@dataclass(frozen=True)
class AssessmentSettings:
    """What counts as an error, a mistake in a file, and a stable model.

    Seconds and metres are those of CyberShip Enterprise 1, times the scale of the ship.

    Attributes:
        chance: 1, of an error of the first kind, of all tests of a question together; contract.
        negligible: 1, share of commands or windows that may be false or unexplained; chosen.
        explained: 1, share from which on most of something is explained, so that it has this cause.
        most_gain: 1, of accelerations over commands, and of commands over full thrust. Derived: half of
            the way, in logarithms, between two thrusters where the model counts one and the foot, the
            smallest of the units, sqrt(2 * 3.28).
        least_gain: 1, as a weak thruster is the diagnosis' matter. Derived: half of the way, in
            logarithms, to the nearest wrong unit of a force or a length, a hundredth.
        sure: standard errors beyond which a gain is wrong; chosen.
        rounding: of the largest command, what a command varies in a file by rounding; less is none.
        own: 1, least share of a command that follows from no other; chosen: a thruster aft that pushes
            sideways and turns at once has none.
        factor: 1, by which another reading explains a right file better, at the most; chosen.
        unbalanced: 1, of what inertia and hull need without a command. Derived: twice the 10 % to which
            coefficients are known.
        long: windows without a command after which the ship has forgotten its thrust; chosen.
        neighbours: windows by which that of a model error is predicted; chosen.
        repeats: 1, share from which on an error is said to repeat; chosen.
        clearer: 1, by which commands must explain more than a force that comes and goes; chosen.
        blocks_per_cluster: 1. Calibrated by tests/test_diagnosis_where.py: with one block three times as
            many regions were found where an error depends on no covariate.
        least_contrast: 1, of the RMS in a region to that elsewhere; chosen.
        largest_region: 1, share of the windows; chosen.
        least_clusters: 1, inside and outside, for three degrees of freedom of each variance.
        share_of_first: 1, of an axis' first model error, from which a remainder matters; contract.
        slow_noise: 1, variance by noise of a mean over windows, as a share of that of independent ones;
            measured 0.04 to 0.13 without a hidden cause, and doubled.
        no_less: 1, share of a dissipation; chosen, as no coefficient is known to 1 %.
        directions: motions on each edge of a region, and speeds; chosen, within 1 % of the eigenvalues.
        coverage: 1, share of a measured motion that an operating region holds; chosen.
        least_region: 1, of the default limits, so that an axis that hardly moves is checked; chosen.
        limits: m/s, m/s, rad/s, of the default region: 99 % of each run published of the ship.
        coasting: s, after which motion has died away, or doubled many times; chosen.
        runaway: 1, times the speeds of the region; chosen.
        step: s, of simulations; chosen, distances agree with those at 0.01 s to 3 %.
        bound: m, four ship lengths, beyond which a ship is lost; a good loop stays in a tenth of it.
    """

    chance: float = 0.01
    negligible: float = 0.05
    explained: float = 0.5
    most_gain: float = 2.5
    least_gain: float = 0.1
    sure: float = 3.0
    rounding: float = 1e-6
    own: float = 0.01
    factor: float = 4.0
    unbalanced: float = 0.2
    long: int = 20
    neighbours: int = 5
    repeats: float = 0.25
    clearer: float = 0.1
    blocks_per_cluster: int = 2
    least_contrast: float = 1.4
    largest_region: float = 0.6
    least_clusters: int = 4
    share_of_first: float = 0.05
    slow_noise: float = 0.25
    no_less: float = 0.01
    directions: int = 21
    coverage: float = 0.99
    least_region: float = 0.1
    limits: tuple[float, float, float] = (0.4, 0.2, 0.6)
    coasting: float = 60.0
    runaway: float = 3.0
    step: float = 0.08
    bound: float = 5.0


SETTINGS = AssessmentSettings()
