"""Tables, pictures and studies."""
