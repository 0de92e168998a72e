//! The renderer: scenes prepared once, then any number of frames.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering::Relaxed},
    },
    vec::Vec,
};

use rayon::prelude::*;

use super::{
    CameraView, Film, RenderError, RenderSettings,
    context::{FrameContext, InstanceInfo},
    lights::LightSource,
    prepared::PreparedScene,
    rays::RayMaker,
    sky::Sky,
    tile::{BAND_ROWS, Band, BandTask},
    vertex_cache::VertexCache,
};
use crate::{
    anim::Pose,
    geom::Aabb,
    scene::{PartInstance, Scene},
    simd::{check_float_mode, dispatch},
    world::World,
};

/// Level of the sky beside lights of the file's own, and beside the default key light.
const SKY_LEVELS: [f32; 2] = [0.30, 1.0];

/// Renders worlds. Textures, materials and exposure are prepared once a scene; buffers are kept between frames,
/// so a frame of a known scene allocates nothing.
///
/// ```
/// use kinora::render::{CameraView, Film, Renderer, RenderSettings};
/// # fn frame(world: &kinora::world::World) -> Result<(), kinora::render::RenderError> {
/// let mut renderer = Renderer::default();
/// let mut film = Film::new(1280, 720);
/// let camera = CameraView::framing(world.bounds(), 1280.0 / 720.0);
/// renderer.render(world, &camera, &RenderSettings::default(), &mut film)?;
/// let mut rgba = Vec::new();
/// film.to_srgb8(&mut rgba);
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Default)]
pub struct Renderer {
    prepared: Vec<PreparedScene>,
    /// Per actor, its prepared scene.
    actors: Vec<u32>,
    instances: Vec<InstanceInfo>,
    lights: Vec<LightSource>,
    normals: VertexCache,
    tangents: VertexCache,
}

impl Renderer {
    /// A renderer with `scenes` prepared, so that the first frame takes no longer than the next ones.
    ///
    /// Scenes that appear in a world later are prepared when they first do; scenes that no longer appear are
    /// dropped.
    pub fn new(scenes: &[Arc<Scene>]) -> Self {
        let mut renderer = Self::default();
        for scene in scenes {
            renderer.prepare(scene);
        }
        renderer
    }

    /// Number of a scene among the prepared ones, prepared now if it is new.
    fn prepare(&mut self, scene: &Arc<Scene>) -> u32 {
        let known = self.prepared.iter().position(|p| Arc::ptr_eq(&p.scene, scene));
        let index = known.unwrap_or_else(|| {
            self.prepared.push(PreparedScene::new(scene.clone()));
            self.prepared.len() - 1
        });
        #[expect(
            clippy::cast_possible_truncation,
            reason = "fewer scenes than instances, which are counted in 32 bits"
        )]
        let index = index as u32;
        index
    }

    /// Bytes of texture levels made beside the scenes' own images.
    pub fn texture_bytes(&self) -> usize {
        self.prepared.iter().map(PreparedScene::texture_bytes).sum()
    }

    /// Renders `world` seen by `camera` into `film` (whose size decides the picture's), in parallel over bands of
    /// the picture in the current rayon pool. Returns the number of rays traced.
    ///
    /// The picture depends on its arguments alone: not on threads, SIMD level, structures or earlier frames.
    ///
    /// # Errors
    /// When foreign code changed how one of the threads computes.
    ///
    /// # Panics
    /// When the machine lacks the SIMD level of `settings`.
    pub fn render(
        &mut self,
        world: &World,
        camera: &CameraView,
        settings: &RenderSettings,
        film: &mut Film,
    ) -> Result<u64, RenderError> {
        let rays = self.render_until(world, camera, settings, film, &AtomicBool::new(false))?;
        Ok(rays.unwrap_or(0))
    }

    /// As [`Renderer::render`], but gives up soon after `stop` becomes true: then `None`, and the film's content is
    /// unspecified.
    ///
    /// # Errors
    /// As [`Renderer::render`]; the film's content is then unspecified too.
    ///
    /// # Panics
    /// As [`Renderer::render`].
    pub fn render_until(
        &mut self,
        world: &World,
        camera: &CameraView,
        settings: &RenderSettings,
        film: &mut Film,
        stop: &AtomicBool,
    ) -> Result<Option<u64>, RenderError> {
        check_float_mode()?;
        film.resize(film.width, film.height);
        film.display = !settings.shading.is_lit();
        film.simd = settings.simd;
        if film.color.is_empty() {
            return Ok(Some(0));
        }
        self.begin(world);
        let ctx = self.context(world, camera, settings, [film.width, film.height]);
        let rows = film.width as usize * BAND_ROWS;
        let rays = AtomicU64::new(0);
        film.color
            .par_chunks_mut(rows)
            .zip(film.depth.par_chunks_mut(rows))
            .zip(film.instance.par_chunks_mut(rows))
            .enumerate()
            .try_for_each(|(index, ((color, depth), instance))| {
                if stop.load(Relaxed) {
                    return Ok(());
                }
                check_float_mode()?;
                #[expect(clippy::cast_possible_truncation, reason = "below the film's height")]
                let top = (index * BAND_ROWS) as u32;
                let band = Band { top, color, depth, instance };
                rays.fetch_add(dispatch(ctx.settings.simd, BandTask { ctx: &ctx, band }), Relaxed);
                Ok::<_, RenderError>(())
            })?;
        Ok((!stop.load(Relaxed)).then(|| rays.into_inner()))
    }

    /// Brings the lists up to the world's actors, instances and lights.
    fn begin(&mut self, world: &World) {
        self.match_actors(world);
        self.instances.clear();
        let mut vertices = 0;
        for placed in world.instances() {
            let prepared = self.actors[placed.actor as usize];
            let scene = &self.prepared[prepared as usize];
            let part = placed.part;
            self.instances.push(InstanceInfo {
                prepared,
                material: scene.material_of(part.mesh.index(), part.part as usize),
                first_vertex: vertices,
                mirrored: is_mirrored(&scene.scene, world.actor_pose(placed.actor as usize), part),
                part,
            });
            vertices += scene.scene.part(part).positions.len();
        }
        self.normals.begin(vertices);
        let maps = self.prepared.iter().any(PreparedScene::has_tangents);
        self.tangents.begin(if maps { vertices } else { 0 });
        self.collect_lights(world);
    }

    /// Makes sure that every actor's scene is prepared and no other is kept.
    fn match_actors(&mut self, world: &World) {
        self.actors.clear();
        for actor in 0..world.actor_count() {
            let index = self.prepare(world.shared_scene(actor));
            self.actors.push(index);
        }
        if (0..self.prepared.len()).any(|i| !self.actors.iter().any(|&a| a as usize == i)) {
            let actors = &self.actors;
            let mut index = 0;
            self.prepared.retain(|_| {
                index += 1;
                actors.iter().any(|&a| a as usize == index - 1)
            });
            self.match_actors(world);
        }
    }

    fn collect_lights(&mut self, world: &World) {
        self.lights.clear();
        let exposure = self.exposure();
        for (actor, &index) in self.actors.iter().enumerate() {
            let prepared = &self.prepared[index as usize];
            let pose = world.actor_pose(actor);
            let placed = |&node| LightSource::at_node(&prepared.scene, pose, node, exposure);
            self.lights.extend(prepared.light_nodes.iter().filter_map(placed));
        }
        if !self.has_own_lights() {
            self.lights.push(LightSource::key());
        }
    }

    /// One exposure for everything in the picture: that of the brightest-lit scene.
    fn exposure(&self) -> f32 {
        self.prepared.iter().filter(|p| !p.light_nodes.is_empty()).map(|p| p.exposure).fold(f32::INFINITY, f32::min)
    }

    fn has_own_lights(&self) -> bool {
        self.prepared.iter().any(|p| !p.light_nodes.is_empty())
    }

    fn context<'a>(
        &'a self,
        world: &'a World,
        camera: &CameraView,
        settings: &RenderSettings,
        size: [u32; 2],
    ) -> FrameContext<'a> {
        let rays = RayMaker::new(camera, size[0], size[1]);
        let bounds = world.bounds();
        let own = self.has_own_lights();
        FrameContext {
            world,
            prepared: &self.prepared,
            instances: &self.instances,
            normals: &self.normals,
            tangents: &self.tangents,
            lights: &self.lights,
            sky: Sky::new(SKY_LEVELS[usize::from(!own)]),
            emission: if own { self.exposure().clamp(0.25, 4.0) } else { 1.0 },
            rays,
            settings: RenderSettings { samples: settings.samples.max(1), ..*settings },
            pierced: self.prepared.iter().any(|p| p.pierced),
            reach: reach(bounds),
            depth_range: rays.depth_range(bounds),
            size,
            rect: rays.pixel_rect(bounds),
        }
    }
}

/// How far ambient occlusion looks: a fifth of the scene's diagonal.
fn reach(bounds: Aabb) -> f32 {
    let reach = bounds.diagonal() * 0.2;
    if reach > 0.0 { reach } else { f32::INFINITY }
}

/// True when an instance's matrix turns its triangles' winding. A skinned part follows its joints, which move
/// together in this respect; the first one answers for all.
fn is_mirrored(scene: &Scene, pose: &Pose, part: PartInstance) -> bool {
    let node = &scene.nodes[part.node.index()];
    let skinned = node.skin.filter(|_| scene.part(part).influences.is_some());
    if let Some(matrix) = skinned.and_then(|skin| pose.joint_matrices(skin).first()) {
        return matrix.matrix3.determinant() < 0.0;
    }
    let copy = part.copy.and_then(|copy| node.copies.as_ref()?.get(copy as usize));
    let flips = copy.map_or(1.0, |copy| copy.scale.x.signum() * copy.scale.y.signum() * copy.scale.z.signum());
    pose.world_from_node(part.node).matrix3.determinant() * flips < 0.0
}
