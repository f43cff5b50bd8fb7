import numpy as np
import pytest

from vinsar.processing.patches import Patches


def speckle(seed, shape):
    return np.random.default_rng(seed).normal(size=(*shape, 2)).view(complex)[..., 0]


@pytest.mark.parametrize(
    ("shape", "side", "step"), [((21, 18), 8, 2), ((5, 30), 9, 3), ((1, 1), 4, 2)]
)
def test_each_spectrum_is_that_of_its_patch_alone(shape, side, step):
    image = speckle(1, shape)
    patches = Patches(shape, side, step)
    found = patches.spectra(patches.padded(image), 0, patches.across)
    assert found.shape == (patches.across, side, patches.down, side)
    lead = side - step
    padded = np.pad(image, ((lead, lead + 2 * side), (lead, lead + 2 * side)))
    for j in range(patches.across):
        for i in range(patches.down):
            patch = padded[i * step : i * step + side, j * step : j * step + side]
            # Single precision through two transforms: some ten roundings of 6e-8 of the largest.
            np.testing.assert_allclose(
                found[j, :, i], np.fft.fft2(patch).T, atol=1e-6 * side * np.abs(image).max()
            )


@pytest.mark.parametrize("begins", [[0], [0, 2], [0, 1, 4]])
def test_bands_of_unchanged_spectra_add_up_to_the_image(begins):
    image = speckle(2, (13, 20))
    patches = Patches(image.shape, 8, 4)
    padded = patches.padded(image)
    bands = [
        patches.band(patches.spectra(padded, begin, end))
        for begin, end in zip(begins, [*begins[1:], patches.across], strict=True)
    ]
    np.testing.assert_allclose(patches.image(bands, begins), image, atol=2e-6 * np.abs(image).max())


def test_values_of_patches_are_spread_as_patches_of_these_values_add_up():
    patches = Patches((13, 20), 8, 2)
    values = np.random.default_rng(3).random((patches.down, patches.across))
    # Only its first coefficient: each patch is one value throughout.
    spectra = np.zeros((patches.across, 8, patches.down, 8), np.complex64)
    spectra[:, 0, :, 0] = 64 * values.T
    expected = patches.image([patches.band(spectra)], [0])
    np.testing.assert_allclose(patches.spread(values), expected, atol=2e-6)
    np.testing.assert_allclose(patches.spread(np.ones_like(values)), 1, atol=1e-6)


def test_middles_are_where_the_patches_are():
    rows, columns = Patches((40, 16), 8, 4).centers()
    assert list(rows[:4]) == [0, 4, 8, 12]
    assert rows.max() <= 39
    assert columns.max() <= 15
