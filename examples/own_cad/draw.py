# SPDX-License-Identifier: Apache-2.0
"""Draw a finger with a closed chamber as finger.step: replace it by a drawing of yours."""

import gmsh

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
body = gmsh.model.occ.addBox(0.0, -10.0, -10.0, 60.0, 20.0, 20.0)  # mm, the unit of STEP files
chamber = gmsh.model.occ.addBox(6.0, -5.0, -3.0, 48.0, 10.0, 9.0)
gmsh.model.occ.cut([(3, body)], [(3, chamber)])
gmsh.model.occ.synchronize()
gmsh.write("finger.step")
gmsh.finalize()
