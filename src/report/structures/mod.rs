//! Every acceleration structure on scenes and on meshes of growing size.
