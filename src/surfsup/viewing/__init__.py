"""What a person looks at: pictures, videos and a web page, from arrays of positions and a triangle mesh."""
