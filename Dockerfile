# The environment of dolfin_tongue: Debian 13 and Debian's own packages only.
# `./tongue` builds this file with docker, podman or buildah, whichever it finds, and shows the
# lines that begin with "==>" while it does.
ARG BASE=debian:trixie-slim
FROM ${BASE}

ARG DEBIAN_FRONTEND=noninteractive

# Nobody reads manuals in here: a tenth of the image.
RUN printf 'path-exclude=/usr/share/%s/*\n' doc man locale >/etc/dpkg/dpkg.cfg.d/no-manuals

# Finite elements: DOLFINx 0.9 (real scalars), PETSc 3.22, and gcc for the form compiler.
# The pthread OpenBLAS replaces the reference BLAS, on which MUMPS is 3.6 times slower.
RUN echo '==> finite elements: DOLFINx, PETSc, form compiler' \
 && apt-get update \
 && apt-get install -y --no-install-recommends \
      python3-dolfinx-real python3-petsc4py-real libopenblas0-pthread gcc libc6-dev python3-dev \
 && apt-get clean && rm -rf /var/lib/apt/lists/*

RUN echo '==> geometry, numerics, command line' \
 && apt-get update \
 && apt-get install -y --no-install-recommends \
      gmsh python3-gmsh python3-meshio python3-numba python3-scipy python3-rich python3-typer \
 && apt-get clean && rm -rf /var/lib/apt/lists/*

# VTK draws through X: Xvfb is the display, Mesa the software OpenGL. An Xvfb without root cannot
# make the folder of its socket.
RUN echo '==> pictures: pyvista, matplotlib, software OpenGL' \
 && apt-get update \
 && apt-get install -y --no-install-recommends \
      python3-pyvista python3-matplotlib python3-imageio python3-pil xvfb libgl1-mesa-dri \
 && apt-get clean && rm -rf /var/lib/apt/lists/* \
 && mkdir -p -m 1777 /tmp/.X11-unix

RUN echo '==> checks: pytest, hypothesis, mypy, flake8' \
 && apt-get update \
 && apt-get install -y --no-install-recommends \
      python3-pytest python3-pytest-xdist python3-hypothesis mypy \
      flake8 python3-flake8-docstrings isort \
 && apt-get clean && rm -rf /var/lib/apt/lists/*

# One thread: the models are small, and the threads of a BLAS only wait for each other here.
ENV OMP_NUM_THREADS=1

CMD ["bash"]
