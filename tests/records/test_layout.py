"""Records of several coordinates take the layout of a single mass: halves, blocks, stretches, thinning."""

from dataclasses import replace

import numpy as np
import pytest

from study.records.excitation import Excitation, force
from study.records.plan import SHORTEST_PART
from study.records.record import Record, Sensor, record_of
from study.records.record_layout import KindOfTest, Layout, laid_out, runs_on
from study.records.sampling_rate import without_spare_samples
from study.support.errors import StudyError

SAMPLES, DT = 4096, 0.05
SLOW, FAST = 40, 16  # samples in a period
RANDOM = Excitation("gaussian_lowpass", cutoff=6.0)
SWEEP = Excitation("swept_sine", start_frequency=0.3, stop_frequency=6.0, sweep="linear")


def of_two(drive=None, first="displacement", second="displacement", dt=DT) -> Record:
    """A slow and a fast motion; driven or not."""
    samples = SAMPLES if drive is None else len(drive)
    along, rng = np.arange(samples), np.random.default_rng(1)
    fade = np.exp(-along / samples) if drive is None else np.ones(samples)
    motions = {
        Sensor(name, motion): fade * np.sin(2.0 * np.pi * along / period) + 1e-3 * rng.standard_normal(samples)
        for name, motion, period in (("a", first, SLOW), ("b", second, FAST))
    }
    return record_of(dt, {} if drive is None else {"shaker": drive}, motions, name="pair")


def test_halves_of_a_driven_record():
    prepared = laid_out([of_two(force(RANDOM, SAMPLES, DT, 1))], Layout())
    assert (prepared.plan.fit, prepared.plan.judge) == ((0, 2048), (2048, 4096))
    assert prepared.sensors == (Sensor("a", "displacement"), Sensor("b", "displacement"))
    assert prepared.measured.shape == (SAMPLES, 2)
    np.testing.assert_array_equal(prepared.measured[:, 1], prepared.record["b displacement"])
    assert prepared.record.motion("a").shape == (3, SAMPLES)


def test_blocks_of_a_decay_hold_five_periods_of_the_slowest_motion_and_it_runs_on_through_them():
    prepared = laid_out([of_two()], Layout())
    lengths = [len(stretch) for stretch in prepared.record.stretches]
    assert min(lengths) >= 5 * SLOW - 1
    assert max(lengths) < 6 * SLOW
    assert runs_on(prepared)
    assert len(prepared.record.begins) == 1, "the judged motion begins once"
    assert any("runs on through the other's" in note for note in prepared.notes)


def fading(samples: int, shorter: int = 1) -> Record:
    """A slow decay of one motion, of fewer periods or with fewer samples in each."""
    along = np.arange(0, samples, shorter)
    rng = np.random.default_rng(1)
    motion = np.exp(-2.0 * along / samples) * np.sin(2.0 * np.pi * along / SLOW)
    noisy = motion + 1e-3 * rng.standard_normal(len(along))
    return Record(DT * shorter, {"force": np.zeros(len(along)), "displacement": noisy}, name="decay")


def test_a_decay_of_few_periods_has_eight_blocks_and_either_part_all_amplitudes():
    prepared = laid_out([fading(16 * SLOW)], Layout())  # four blocks of four periods would part loud from quiet
    assert len(prepared.record.stretches) == 8
    assert np.std(prepared.judged) == pytest.approx(np.exp(-2.0 / 8.0) * np.std(prepared.fitted), rel=0.05)
    two = laid_out([fading(16 * SLOW), replace(fading(16 * SLOW), name="again")], Layout())
    assert len(two.record.stretches) == 8, "of both together"


def test_no_block_of_a_decay_is_shorter_than_a_part_may_be():
    record = fading(16 * SLOW, shorter=2)
    lengths = [len(stretch) for stretch in laid_out([record], Layout()).record.stretches]
    assert min(lengths) >= SHORTEST_PART
    assert sum(lengths) > 0.9 * len(record) > 4 * SHORTEST_PART


def test_a_decay_that_begins_anew_does_so_in_each_block_of_so_many_periods():
    prepared = laid_out([of_two()], Layout(), KindOfTest(anew=2.0))
    lengths = [len(stretch) for stretch in prepared.record.stretches]
    assert max(lengths) < 5 * SLOW
    assert not runs_on(prepared)
    assert len(prepared.record.begins) == len(lengths) - 1


def test_a_sweep_is_judged_in_every_other_block():
    swept = of_two(force(SWEEP, SAMPLES, DT, 1))
    prepared = laid_out([swept], Layout())
    assert prepared.record.joints
    assert any("same frequencies" in note for note in prepared.notes)
    assert not laid_out([swept], Layout(fit=(0, 2048))).record.joints
    assert not laid_out([swept], Layout(), KindOfTest(unbroken=True)).record.joints


@pytest.mark.parametrize("loud", [slice(0, 2048), slice(2048, SAMPLES)])
def test_blocks_are_judged_in_turn_where_one_half_is_noise(loud: slice):
    record = of_two(force(RANDOM, SAMPLES, DT, 1))
    size = np.full(SAMPLES, 0.05)
    size[loud] = 1.0
    died = record.with_channels({name: size * values for name, values in record.channels.items()})
    prepared = laid_out([died], Layout())
    assert prepared.record.joints
    assert any(note.startswith("one half of the record is nearly at rest") for note in prepared.notes)
    assert not laid_out([died], Layout(fit=(0, 2048))).record.joints
    half = record.with_channels({name: np.sqrt(size) * values for name, values in record.channels.items()})
    assert not laid_out([half], Layout()).record.joints, "a fifth of the motion is no rest"


def test_a_record_that_rests_in_one_half_is_halved_where_it_moves():
    drive = force(RANDOM, SAMPLES, DT, 1)
    still = np.arange(SAMPLES) < 3000
    record = of_two(drive)
    rested = record.with_channels(
        {name: np.where(still, values[0], values) for name, values in record.channels.items()}
    )
    plan = laid_out([rested], Layout()).plan
    assert (plan.fit[0], plan.judge) == (2999, ((2999 + SAMPLES) // 2, SAMPLES))
    one = record.with_channels({"a displacement": rested["a displacement"]})
    assert laid_out([one], Layout()).plan.fit == (0, 2048), "the other one moves"
    with pytest.raises(StudyError, match="a displacement and b displacement of 'pair' does not move in the part"):
        laid_out([rested], Layout(fit=(0, 1000), judge=(3000, 4000)))


def test_an_oversampled_record_is_thinned_as_the_most_telling_sensor_asks():
    slow, rng = np.cumsum(np.cumsum(force(Excitation(cutoff=0.1), 16384, DT, 1))), np.random.default_rng(2)
    drive = force(Excitation(cutoff=0.1), 16384, DT, 1)

    def record(cutoff):
        quick = force(Excitation(cutoff=cutoff), 16384, DT, 5)
        motions = {Sensor("a", "displacement"): slow, Sensor("b", "displacement"): quick}
        noisy = {s: x + 1e-3 * np.std(x) * rng.standard_normal(len(x)) for s, x in motions.items()}
        return record_of(DT, {"shaker": drive}, noisy)

    thinned = without_spare_samples(laid_out([record(0.5)], Layout()))
    assert thinned.every > 1
    assert len(thinned.record) == -(-16384 // thinned.every)
    assert set(thinned.record.sensors) == set(record(0.5).sensors)
    assert without_spare_samples(laid_out([record(8.0)], Layout())).every == 1
    swept = laid_out([record(0.5)], Layout(alternate=True))
    assert swept.every == thinned.every
    assert laid_out([record(0.5)], Layout(alternate=True, as_sampled=True)).every == 1


def test_several_records_and_stretches_are_strung_together():
    drive = force(RANDOM, SAMPLES, DT, 1)
    one, other = of_two(drive), replace(of_two(drive), name="other")
    together = laid_out([one, other], Layout())
    assert {s.source.name for s in together.record.stretches} == {"pair", "other"}
    used = laid_out([one], Layout(use=((10.0, 60.0), (80.0, None))))
    assert np.all((used.record.time < 60.0) | (used.record.time >= 80.0))
    mixed = replace(other, units={**other.units, "b displacement": "mm"})
    with pytest.raises(StudyError, match=r"b displacement is in m in pair|expected the same unit"):
        laid_out([one, replace(mixed, units={**mixed.units, "a displacement": "mm"})], Layout())


def test_the_response_that_is_asked_for_is_compared():
    drive = force(RANDOM, SAMPLES, DT, 1)
    record = of_two(drive)
    both = record.with_motions(record.motions | {Sensor("b", "acceleration"): record["a displacement"]})
    assert laid_out([both], Layout()).sensors == (Sensor("a", "displacement"), Sensor("b", "displacement"))
    with pytest.raises(StudyError, match="pair: no acceleration was measured at a; expected --response displacement"):
        laid_out([both], Layout(response="acceleration"))
    faster = both.with_motions(both.motions | {Sensor("a", "acceleration"): record["b displacement"]})
    chosen = laid_out([faster], Layout(response="acceleration"))
    assert chosen.sensors == (Sensor("a", "acceleration"), Sensor("b", "acceleration"))
    np.testing.assert_array_equal(chosen.measured[:, 0], record["b displacement"])


def test_modes_are_fitted_to_the_first_half_of_each_stretch_and_blocks_are_refused():
    records = [of_two(force(RANDOM, samples, DT, 1)) for samples in (SAMPLES, SAMPLES // 2)]
    prepared = laid_out(records, Layout(as_sampled=True), KindOfTest(unbroken=True))
    assert len(prepared.record.stretches) == 4
    (fit_begin, split), (judge_begin, end) = prepared.plan.fit, prepared.plan.judge
    assert (fit_begin, split) == (0, judge_begin)
    assert split == pytest.approx(end / 2, abs=2)
    assert "of each of 2 stretches the first half is fitted" in " ".join(prepared.notes)
    with pytest.raises(StudyError, match=r"sum of modes.*long stretches; expected --fit A:B"):
        laid_out(records[:1], Layout(alternate=True), KindOfTest(unbroken=True))


def test_a_decay_of_a_single_mass_may_be_judged_in_parts_that_are_named():
    motion = of_two()["a displacement"]
    decay = Record(DT, {"force": np.zeros(SAMPLES), "displacement": motion}, name="decay")
    prepared = laid_out([decay], Layout(fit=(0, 1000), judge=(1000, 3000)))
    assert (prepared.plan.fit, prepared.plan.judge) == ((0, 1000), (1000, 3000))
    assert prepared.free
