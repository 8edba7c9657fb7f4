"""Plain factors to SI, so that numbers read as they are quoted: ``1.5 * kPa``."""

mm = 1e-3
cm = 1e-2
cm2 = 1e-4
cm3 = 1e-6
ms = 1e-3
kPa = 1e3
gram = 1e-3

#: Length beyond which coordinates are taken for millimetres, m.
LARGEST_SIZE = 5.0
