"""Settings that make a scenario small enough for a test, as `Scenario.load` takes them."""


def limit_pixels(number, rays_per_pixel=None):
    """Return settings for a focal plane of `number` by `number` pixels without further rays for small targets.

    Parameters
    ----------
    number : of rows and of columns.
    rays_per_pixel : fixed number of rays per pixel; if None, that of the scenario.
    """
    rays = () if rays_per_pixel is None else (f"lidar.receiver.rays_per_pixel={rays_per_pixel}",)
    pixels = (f"lidar.receiver.n_rows={number}", f"lidar.receiver.n_cols={number}")
    return (*pixels, *rays, "lidar.receiver.min_rays_per_target=0")
