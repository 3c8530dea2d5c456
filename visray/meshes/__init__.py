"""Triangle meshes in NumPy arrays: reads mesh files, and prepares faces, edges and normals."""
