"""Control of any mechanism with a task: its state estimate, and what a controller knows of it."""
