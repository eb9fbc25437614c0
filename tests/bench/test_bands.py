"""The experiment that times images in bands."""

import pytest

from ssgi_cl.bench.experiments import bands


def test_bands_give_the_same_bits_and_are_timed(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bands, "ARRAY_SIZE", (512, 256))
    monkeypatch.setattr(bands, "TECHNIQUES", ("gtao",))
    bands.main(["--size", "512", "--max-memory", "64MiB", "--pairs", "1"])
    said = capsys.readouterr().out
    assert "same file: yes" in said
    rows = [line.split("|")[1:-1] for line in said.splitlines() if line.startswith("| `gtao`")]
    assert len(rows) == len(bands.SHARES)
    for row in rows:
        assert row[-1].strip() == "yes"
        assert float(row[3]) < float(row[1])  # bands have less memory
