"""A learned proposal: a small network looks at a depth crop and says where hands may be and how they are posed."""
