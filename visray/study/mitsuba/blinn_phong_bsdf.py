"""The Blinn-Phong model as a Mitsuba BSDF; Mitsuba itself has none.

Its value is `kd cos + ks (n.h)^shininess` if light and viewer are on the same side of the surface, else 0. `cos` is the
cosine between normal and direction to the light.
"""

from typing import Any

import drjit as dr
import mitsuba as mi

# The variant whose array types are those of visray's kernels.
VARIANT = "llvm_ad_rgb"
mi.set_variant(VARIANT)

DIFFUSE, GLOSSY = 0, 1


class BlinnPhong(mi.BSDF):
    """Blinn-Phong BSDF. Component 0 is the diffuse part, component 1 the highlight.

    Properties: kd, ks (three numbers each), shininess; back_ks, back_shininess: on the side that the normal points away
    from.
    As in visray, neither part is divided by pi, and there is no highlight in lanes where the light is below the
    surface. The methods have the parameters that Mitsuba prescribes: `si` is the hit, `wo` the direction to the light,
    `active` the mask of lanes to evaluate.
    """

    def __init__(self, props: Any):
        mi.BSDF.__init__(self, props)
        self.kd = mi.Color3f(props["kd"])
        # Of the front and of the back.
        self.ks = [mi.Color3f(props[name]) for name in ("ks", "back_ks")]
        self.shininess = [mi.Float(props[name]) for name in ("shininess", "back_shininess")]
        sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        components = (mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.GlossyReflection)
        self.m_components = [int(component | sides) for component in components]
        self.m_flags = self.m_components[0] | self.m_components[1]

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        """Light reflected to the viewer if light of strength 1 arrives from `wo`. The diffuse part contains `cos`."""
        v, l = _to_viewer_side(si, si.wi), _to_viewer_side(si, wo)
        colour = mi.Color3f(0)
        if ctx.is_enabled(mi.BSDFFlags.DiffuseReflection, DIFFUSE):
            colour += self.kd * l.z
        if ctx.is_enabled(mi.BSDFFlags.GlossyReflection, GLOSSY):
            h, inside = dr.normalize(v + l), dr.dot(si.n, si.to_world(si.wi)) < 0
            ks, shininess = (dr.select(inside, back, front) for front, back in (self.ks, self.shininess))
            colour += ks * _power(dr.maximum(h.z, 0), shininess)
        return dr.select(active & (l.z > 0), colour, 0)

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> tuple[Any, Any]:
        """A cosine-distributed direction (BSDFSample3f), and the BSDF's value over the density.

        This is ideal for the diffuse part, and noisy for the highlight.
        """
        local = mi.warp.square_to_cosine_hemisphere(sample2)
        bs = mi.BSDFSample3f()
        bs.wo = _to_viewer_side(si, local)
        bs.pdf = mi.warp.square_to_cosine_hemisphere_pdf(local)
        bs.eta = 1.0
        bs.sampled_type = mi.UInt32(+mi.BSDFFlags.DiffuseReflection)
        bs.sampled_component = mi.UInt32(DIFFUSE)
        return bs, dr.select(bs.pdf > 0, self.eval(ctx, si, bs.wo, active) / bs.pdf, 0)

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        """Density with which `sample` returns the direction `wo`, per steradian."""
        l = _to_viewer_side(si, wo)
        return dr.select(active & (l.z > 0), mi.warp.square_to_cosine_hemisphere_pdf(l), 0)

    def to_string(self) -> str:
        return f"BlinnPhong[kd={self.kd}, ks={self.ks}, shininess={self.shininess}]"


def _to_viewer_side(si: Any, w: Any) -> Any:
    """The direction `w` in the frame whose normal points to the viewer's side of the surface. As in visray, the surface
    itself decides which side this is. On a mesh the normal for shading may then point away from the viewer."""
    side = dr.dot(si.n, si.to_world(si.wi)) * dr.dot(si.n, si.sh_frame.n)
    return mi.Vector3f(w.x, w.y, w.z * dr.sign(side))


def _power(x: Any, exponent: Any) -> Any:
    """x^exponent for x >= 0; 0^0 is 1, as in visray."""
    return dr.select(x > 0, dr.power(dr.select(x > 0, x, 1), exponent), dr.select(exponent > 0, 0, 1))


mi.register_bsdf("blinn_phong", BlinnPhong)
