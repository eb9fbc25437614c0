"""The table of cleaned depth says less error than that of noisy depth."""

from click.testing import CliRunner

from ssgi_cl.bench.experiments.depth_noise import main


def test_the_table_has_a_row_for_each_scene() -> None:
    result = CliRunner().invoke(main, ["--size", "200", "150", "--scene", "cornell_box"])
    assert result.exit_code == 0, result.output
    (row,) = result.output.splitlines()[2:]
    name, noisy, cleaned, depth_noisy, depth_cleaned, _ = (cell.strip() for cell in row.strip("|").split("|"))
    assert name == "cornell_box"
    assert float(cleaned) < 0.6 * float(noisy)
    assert float(depth_cleaned) < 0.6 * float(depth_noisy)
