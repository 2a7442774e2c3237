"""Points with normals as an ASCII PLY."""


def write(path, count, rows):
    """rows: x, y, z, nx, ny, nz of each of `count` points."""
    with open(path, "w") as file:
        print(f"ply\nformat ascii 1.0\nelement vertex {count}", file=file)
        for name in ("x", "y", "z", "nx", "ny", "nz"):
            print(f"property float {name}", file=file)
        print("end_header", file=file)
        for row in rows:
            print(*(f"{value:.6f}" for value in row), file=file)
