use super::{
    World,
    sink::{GroupSink, Unfiltered},
};
use crate::{
    accel::{Closest, PACKET, TravRay},
    geom::{Hit, Ray},
    simd::Simd,
};

/// Worlds of more groups answer packets ray by ray: their top level is walked for single rays.
const FLAT: usize = 8;

impl World {
    /// [`World::nearest_hit`] of up to [`PACKET`] rays at once, quickest for rays close together; `hits` has a place for
    /// each. No allocation.
    ///
    /// # Panics
    /// When there are more rays than [`PACKET`], or not as many places.
    #[inline(always)]
    pub fn nearest_hits<S: Simd>(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        assert_eq!(rays.len(), hits.len(), "one place a ray");
        let Some((packet, active)) = packet(rays).filter(|_| self.groups.len() <= FLAT) else {
            for (hit, ray) in hits.iter_mut().zip(rays) {
                *hit = self.nearest_hit::<S>(ray);
            }
            return;
        };
        let packet = &packet[..rays.len()];
        let mut best = [Closest::new(&packet[0]); PACKET];
        for (best, ray) in best.iter_mut().zip(packet) {
            *best = Closest::new(ray);
        }
        let best = &mut best[..rays.len()];
        for group in &self.groups {
            let sinks = [GroupSink { layout: &group.layout, filter: Unfiltered }; PACKET];
            let sinks = &sinks[..rays.len()];
            group.accel.closest_packet::<S, (), _>(&group.triangles(), packet, active, best, sinks, &mut ());
        }
        for (i, (hit, best)) in hits.iter_mut().zip(best).enumerate() {
            *hit = if (active >> i) & 1 == 1 { best.hit(&packet[i]) } else { None };
        }
    }

    /// [`World::is_blocked`] of up to [`PACKET`] rays at once: bit i is that of ray i. No allocation.
    ///
    /// # Panics
    /// When there are more rays than [`PACKET`].
    #[inline(always)]
    pub fn blocked<S: Simd>(&self, rays: &[Ray]) -> u32 {
        let mut blocked = 0;
        let Some((packet, active)) = packet(rays).filter(|_| self.groups.len() <= FLAT) else {
            for (i, ray) in rays.iter().enumerate() {
                blocked |= u32::from(self.is_blocked::<S>(ray)) << i;
            }
            return blocked;
        };
        let packet = &packet[..rays.len()];
        for group in &self.groups {
            let sinks = [GroupSink { layout: &group.layout, filter: Unfiltered }; PACKET];
            let sinks = &sinks[..rays.len()];
            let open = active & !blocked;
            if open == 0 {
                break;
            }
            blocked |= group.accel.occluded_packet::<S, (), _>(&group.triangles(), packet, open, sinks, &mut ());
        }
        blocked
    }
}

/// The rays as structures want them and the bits of those that are rays; the others repeat one that is. `None` when none
/// is.
#[inline(always)]
fn packet(rays: &[Ray]) -> Option<([TravRay; PACKET], u32)> {
    assert!(rays.len() <= PACKET, "at most {PACKET} rays");
    let stand_in = rays.iter().find_map(TravRay::new)?;
    let (mut packet, mut active) = ([stand_in; PACKET], 0);
    for (i, ray) in rays.iter().enumerate() {
        if let Some(ray) = TravRay::new(ray) {
            packet[i] = ray;
            active |= 1 << i;
        }
    }
    Some((packet, active))
}
